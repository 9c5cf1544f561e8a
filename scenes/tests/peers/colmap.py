"""Writes the models that scenes/src/exchange/colmap is tested on, with pycolmap (4.2.1 wrote those that are kept), and
where pycolmap itself projects their points: colmap_binary/, colmap_text/, colmap.json beside this file. Those named
colmap_rig are a model with rigs and frames, and the poses of its pictures.

    pip install pycolmap numpy && python colmap.py
"""

import json
from pathlib import Path

import numpy as np
import pycolmap

HERE = Path(__file__).parent
LENSES = [
    ("PINHOLE", [610.0, 600.0, 322.5, 241.0]),
    ("OPENCV", [580.0, 590.0, 318.0, 238.5, -0.12, 0.04, 1e-3, -2e-3]),
    ("SIMPLE_RADIAL", [550.0, 320.0, 240.0, -0.08]),
]
# Where cameras stand, and the picture each takes of the room's middle.
EYES = {"hall/a b.jpg": (4.0, -0.5, 2.2), "door.png": (0.3, -3.5, 2.6), "desk.jpg": (-3.0, 2.5, 1.9)}
MIDDLE = np.array([0.0, 0.0, 0.4])


def looking_at_the_middle(eye):
    forward = MIDDLE - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ eye)


model = pycolmap.Reconstruction()
floor = [np.array([0.1 * x - 0.3, 0.1 * y - 0.3, 0.0]) for x in range(7) for y in range(6)]
images = []
for number, ((lens, parameters), (name, eye)) in enumerate(zip(LENSES, EYES.items()), start=3):
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(camera_id=number, model=lens, width=640, height=480, params=parameters)
    )
    image = pycolmap.Image(name=name, camera_id=number, image_id=number)
    pose = looking_at_the_middle(np.array(eye))
    pixels = [model.cameras[number].img_from_cam(pose * point) for point in floor]
    # A few pixels of no point, too.
    image.points2D = pycolmap.Point2DList([pycolmap.Point2D(p) for p in [*pixels, np.array([5.0, 7.0])]])
    model.add_image_with_trivial_frame(image, pose)
    images.append((name, number))
for index, point in enumerate(floor):
    # Tracks of one, two and three pictures.
    seen = images[: 1 + index % 3]
    track = pycolmap.Track([pycolmap.TrackElement(number, index) for _, number in seen])
    model.add_point3D(point, track, np.array([5 * index, 255 - index, 7], dtype=np.uint8))

for folder, write in (("colmap_binary", model.write_binary), ("colmap_text", model.write_text)):
    target = HERE / folder
    target.mkdir(exist_ok=True)
    write(target)
    for unread in ("rigs", "frames"):
        for file in target.glob(unread + ".*"):
            file.unlink()

expected = {
    "points": [
        {"place": list(point.xyz), "color": [int(c) for c in point.color]}
        for _, point in sorted(model.points3D.items())
    ],
    # Pixels of each point, counted from the top-left pixel's corner.
    "pixels": {
        name: [list(model.images[number].project_point(p.xyz)) for _, p in sorted(model.points3D.items())]
        for name, number in images
    },
}
(HERE / "colmap.json").write_text(json.dumps(expected, indent=1) + "\n")


# A rig of two cameras at two moments: images.* repeat the poses that frames.* and rigs.* state.
def pose(axis, angle, place):
    return pycolmap.Rigid3d(
        pycolmap.Rotation3d(np.append(np.sin(angle / 2) * np.array(axis), np.cos(angle / 2))), np.array(place)
    )


def sensor(number):
    return pycolmap.sensor_t(type=pycolmap.SensorType.CAMERA, id=number)


rigged = pycolmap.Reconstruction()
for number, (lens, parameters) in enumerate([LENSES[0], LENSES[2]], start=1):
    rigged.add_camera(pycolmap.Camera(camera_id=number, model=lens, width=640, height=480, params=parameters))
rig = pycolmap.Rig(rig_id=4)
rig.add_ref_sensor(sensor(1))
rig.add_sensor(sensor(2), pose([0, 1, 0], 0.6, [0.1, 0.2, 0.3]))
rigged.add_rig(rig)
for moment in range(2):
    frame = pycolmap.Frame(
        frame_id=moment + 1, rig_id=4, rig_from_world=pose([0, 0, 1], 0.4 * moment, [1.0 + moment, 2.0, 3.0])
    )
    for number in (1, 2):
        frame.add_data_id(pycolmap.data_t(sensor(number), 10 * moment + number))
    rigged.add_frame(frame)
    for number in (1, 2):
        image = pycolmap.Image(name=f"eye{number}/{moment}.jpg", camera_id=number, image_id=10 * moment + number)
        image.frame_id = moment + 1
        rigged.add_image(image)
    rigged.register_frame(moment + 1)
for folder, write in (("colmap_rig_binary", rigged.write_binary), ("colmap_rig_text", rigged.write_text)):
    target = HERE / folder
    target.mkdir(exist_ok=True)
    write(target)
poses = {image.name: image.cam_from_world().matrix().tolist() for image in rigged.images.values()}
(HERE / "colmap_rig.json").write_text(json.dumps(poses, indent=1, sort_keys=True) + "\n")

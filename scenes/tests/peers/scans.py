"""Writes the scans that scenes/src/geometry reads in its tests, with laspy and trimesh (2.7.0 and 5.2.0 wrote those that
are kept), and what these programs say of them: scans/ beside this file.

    pip install "laspy[lazrs]" trimesh pillow numpy && python scans.py
"""

import json
from pathlib import Path

import laspy
import numpy as np
import trimesh
from PIL import Image

OUT = Path(__file__).parent / "scans"
OUT.mkdir(exist_ok=True)

# Sixty points of UTM on a floor that rises a millimetre a point, with 16-bit colours, and with bytes in their place.
index = np.arange(60)
for name, full in (("floor.las", 257), ("floor.laz", 257), ("bytes.las", 1)):
    header = laspy.LasHeader(point_format=7 if name != "bytes.las" else 3, version="1.4" if name != "bytes.las" else "1.2")
    header.offsets = [500000.0, 5400000.0, 0.0]
    header.scales = [0.001, 0.001, 0.001]
    cloud = laspy.LasData(header)
    cloud.x = 500003.0 + 0.1 * (index % 10)
    cloud.y = 5400010.25 + 0.1 * (index // 10)
    cloud.z = 0.001 * index
    cloud.red, cloud.green, cloud.blue = full * index, full * np.full(60, 200), full * (255 - index)
    cloud.write(OUT / name)

# A box with colours in a node that moves and turns it.
box = trimesh.creation.box(extents=[4.0, 3.0, 2.5])
box.apply_translation([2.0, 1.5, 1.25])
box.visual.vertex_colors = np.array([[20 * i, 255 - 20 * i, 7, 255] for i in range(8)], dtype=np.uint8)
way = trimesh.transformations.rotation_matrix(0.7, [1.0, 2.0, 3.0])
way[:3, 3] = [5.0, -1.0, 0.5]
scene = trimesh.Scene()
scene.add_geometry(box, transform=way)
(OUT / "box.glb").write_bytes(scene.export(file_type="glb"))
corners = trimesh.transform_points(box.vertices, way)
(OUT / "box.json").write_text(
    json.dumps({"corners": corners.tolist(), "colors": box.visual.vertex_colors[:, :3].tolist()}) + "\n"
)

# A square with a texture, as one file and as several.
pixels = np.array([[[250, 10, 20], [30, 240, 40]], [[50, 60, 230], [128, 128, 128]]], dtype=np.uint8)
uv = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
square = trimesh.Trimesh(
    vertices=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]], process=False
)
square.visual = trimesh.visual.TextureVisuals(
    uv=uv, material=trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
)
(OUT / "textured.glb").write_bytes(trimesh.Scene(square).export(file_type="glb"))
for name, content in trimesh.Scene(square).export(file_type="gltf").items():
    (OUT / name.replace("model.gltf", "textured.gltf")).write_bytes(content)
# trimesh counts v from the bottom.
colors = [pixels[int((1 - v) * 2), int(u * 2)].tolist() for u, v in uv]
(OUT / "textured.json").write_text(json.dumps(colors) + "\n")

cloud = trimesh.PointCloud([[0, 0, 0], [1, 0, 0], [2, 0.5, 0], [3, 0.5, -1], [4, 0, 0]])
(OUT / "points.glb").write_bytes(trimesh.Scene(cloud).export(file_type="glb"))

//! Foxglove's schemas that an export uses, and their descriptors: what tells a reader how to decode the messages.
//!
//! Names, field numbers and types are those of <https://github.com/foxglove/foxglove-sdk/tree/main/schemas/proto>.

use super::wire::ProtoMessage;

/// Type of a field.
#[derive(Debug, Clone, Copy)]
enum FieldType {
    Double,
    Fixed32,
    Int32,
    Int64,
    Bool,
    Text,
    Bytes,
    /// Message of this full name, with a leading dot.
    Message(&'static str),
    /// Enumeration that the message itself declares under this name.
    Enum(&'static str),
}

/// A field: name, number, type, and whether it is repeated.
type Field = (&'static str, u64, FieldType, bool);

/// A message of a schema file.
struct Schema {
    name: &'static str,
    fields: &'static [Field],
    /// An enumeration's name and its enumerators, numbered from 0.
    enumeration: Option<(&'static str, &'static [&'static str])>,
}

use FieldType::{Bool, Bytes, Double, Enum, Fixed32, Int32, Int64, Message, Text};

const TIMESTAMP: FieldType = Message(".google.protobuf.Timestamp");
const POSE: FieldType = Message(".foxglove.Pose");
const VECTOR3: FieldType = Message(".foxglove.Vector3");
const COLOR: FieldType = Message(".foxglove.Color");
const POINT3: FieldType = Message(".foxglove.Point3");

/// Messages of the package `foxglove`.
const FOXGLOVE: &[Schema] = &[
    plain("Vector3", &[("x", 1, Double, false), ("y", 2, Double, false), ("z", 3, Double, false)]),
    plain("Point3", &[("x", 1, Double, false), ("y", 2, Double, false), ("z", 3, Double, false)]),
    plain(
        "Quaternion",
        &[("x", 1, Double, false), ("y", 2, Double, false), ("z", 3, Double, false), ("w", 4, Double, false)],
    ),
    plain(
        "Color",
        &[("r", 1, Double, false), ("g", 2, Double, false), ("b", 3, Double, false), ("a", 4, Double, false)],
    ),
    plain(
        "Pose",
        &[("position", 1, VECTOR3, false), ("orientation", 2, Message(".foxglove.Quaternion"), false)],
    ),
    plain("KeyValuePair", &[("key", 1, Text, false), ("value", 2, Text, false)]),
    plain(
        "FrameTransform",
        &[
            ("timestamp", 1, TIMESTAMP, false),
            ("parent_frame_id", 2, Text, false),
            ("child_frame_id", 3, Text, false),
            ("translation", 4, VECTOR3, false),
            ("rotation", 5, Message(".foxglove.Quaternion"), false),
        ],
    ),
    plain(
        "PosesInFrame",
        &[("timestamp", 1, TIMESTAMP, false), ("frame_id", 2, Text, false), ("poses", 3, POSE, true)],
    ),
    plain(
        "CompressedImage",
        &[
            ("timestamp", 1, TIMESTAMP, false),
            ("data", 2, Bytes, false),
            ("format", 3, Text, false),
            ("frame_id", 4, Text, false),
        ],
    ),
    plain(
        "CameraCalibration",
        &[
            ("timestamp", 1, TIMESTAMP, false),
            ("width", 2, Fixed32, false),
            ("height", 3, Fixed32, false),
            ("distortion_model", 4, Text, false),
            ("D", 5, Double, true),
            ("K", 6, Double, true),
            ("R", 7, Double, true),
            ("P", 8, Double, true),
            ("frame_id", 9, Text, false),
        ],
    ),
    Schema {
        name: "Log",
        fields: &[
            ("timestamp", 1, TIMESTAMP, false),
            ("level", 2, Enum("Level"), false),
            ("message", 3, Text, false),
            ("name", 4, Text, false),
            ("file", 5, Text, false),
            ("line", 6, Fixed32, false),
        ],
        enumeration: Some(("Level", &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"])),
    },
    Schema {
        name: "SceneEntityDeletion",
        fields: &[
            ("timestamp", 1, TIMESTAMP, false),
            ("type", 2, Enum("Type"), false),
            ("id", 3, Text, false),
        ],
        enumeration: Some(("Type", &["MATCHING_ID", "ALL"])),
    },
    plain(
        "SceneUpdate",
        &[
            ("deletions", 1, Message(".foxglove.SceneEntityDeletion"), true),
            ("entities", 2, Message(".foxglove.SceneEntity"), true),
        ],
    ),
    plain(
        "SceneEntity",
        &[
            ("timestamp", 1, TIMESTAMP, false),
            ("frame_id", 2, Text, false),
            ("id", 3, Text, false),
            ("lifetime", 4, Message(".google.protobuf.Duration"), false),
            ("frame_locked", 5, Bool, false),
            ("metadata", 6, Message(".foxglove.KeyValuePair"), true),
            ("arrows", 7, Message(".foxglove.ArrowPrimitive"), true),
            ("cubes", 8, Message(".foxglove.CubePrimitive"), true),
            ("spheres", 9, Message(".foxglove.SpherePrimitive"), true),
            ("cylinders", 10, Message(".foxglove.CylinderPrimitive"), true),
            ("lines", 11, Message(".foxglove.LinePrimitive"), true),
            ("triangles", 12, Message(".foxglove.TriangleListPrimitive"), true),
            ("texts", 13, Message(".foxglove.TextPrimitive"), true),
            ("models", 14, Message(".foxglove.ModelPrimitive"), true),
        ],
    ),
    plain(
        "ArrowPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("shaft_length", 2, Double, false),
            ("shaft_diameter", 3, Double, false),
            ("head_length", 4, Double, false),
            ("head_diameter", 5, Double, false),
            ("color", 6, COLOR, false),
        ],
    ),
    plain(
        "CubePrimitive",
        &[("pose", 1, POSE, false), ("size", 2, VECTOR3, false), ("color", 3, COLOR, false)],
    ),
    plain(
        "SpherePrimitive",
        &[("pose", 1, POSE, false), ("size", 2, VECTOR3, false), ("color", 3, COLOR, false)],
    ),
    plain(
        "CylinderPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("size", 2, VECTOR3, false),
            ("bottom_scale", 3, Double, false),
            ("top_scale", 4, Double, false),
            ("color", 5, COLOR, false),
        ],
    ),
    Schema {
        name: "LinePrimitive",
        fields: &[
            ("type", 1, Enum("Type"), false),
            ("pose", 2, POSE, false),
            ("thickness", 3, Double, false),
            ("scale_invariant", 4, Bool, false),
            ("points", 5, POINT3, true),
            ("color", 6, COLOR, false),
            ("colors", 7, COLOR, true),
            ("indices", 8, Fixed32, true),
        ],
        enumeration: Some(("Type", &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"])),
    },
    plain(
        "TriangleListPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("points", 2, POINT3, true),
            ("color", 3, COLOR, false),
            ("colors", 4, COLOR, true),
            ("indices", 5, Fixed32, true),
        ],
    ),
    plain(
        "TextPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("billboard", 2, Bool, false),
            ("font_size", 3, Double, false),
            ("scale_invariant", 4, Bool, false),
            ("color", 5, COLOR, false),
            ("text", 6, Text, false),
        ],
    ),
    plain(
        "ModelPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("scale", 2, VECTOR3, false),
            ("color", 3, COLOR, false),
            ("override_color", 4, Bool, false),
            ("url", 5, Text, false),
            ("media_type", 6, Text, false),
            ("data", 7, Bytes, false),
        ],
    ),
];

const SECONDS: &[Field] = &[("seconds", 1, Int64, false), ("nanos", 2, Int32, false)];

const fn plain(name: &'static str, fields: &'static [Field]) -> Schema {
    Schema { name, fields, enumeration: None }
}

/// The descriptors of all messages above, as a serialised `google.protobuf.FileDescriptorSet`.
pub(super) fn descriptors() -> Vec<u8> {
    let google = |file: &str, schema: Schema| {
        descriptor_file(&format!("google/protobuf/{file}.proto"), "google.protobuf", &[], &[schema])
    };
    let files = [
        google("timestamp", plain("Timestamp", SECONDS)),
        google("duration", plain("Duration", SECONDS)),
        descriptor_file(
            "foxglove.proto",
            "foxglove",
            &["google/protobuf/timestamp.proto", "google/protobuf/duration.proto"],
            FOXGLOVE,
        ),
    ];
    ProtoMessage::new().messages(1, files).into_bytes()
}

/// `FileDescriptorProto`: name 1, package 2, dependency 3, `message_type` 4, syntax 12.
fn descriptor_file(name: &str, package: &str, imports: &[&str], schemas: &[Schema]) -> ProtoMessage {
    let file = ProtoMessage::new().text(1, name).text(2, package);
    let file = imports.iter().fold(file, |file, import| file.text(3, import));
    file.messages(4, schemas.iter().map(|schema| message_descriptor(package, schema))).text(12, "proto3")
}

/// `DescriptorProto`: name 1, field 2, `enum_type` 4. `EnumDescriptorProto`: name 1, value 2, with name 1 and number 2.
fn message_descriptor(package: &str, schema: &Schema) -> ProtoMessage {
    let fields = schema.fields.iter().map(|field| field_descriptor(package, schema.name, field));
    let message = ProtoMessage::new().text(1, schema.name).messages(2, fields);
    let Some((name, enumerators)) = schema.enumeration else { return message };
    let values =
        (0..).zip(enumerators).map(|(number, name)| ProtoMessage::new().text(1, name).uint(2, number));
    message.message(4, &ProtoMessage::new().text(1, name).messages(2, values))
}

/// `FieldDescriptorProto`: name 1, number 3, label 4, type 5, `type_name` 6.
fn field_descriptor(package: &str, message: &str, (name, number, kind, is_repeated): &Field) -> ProtoMessage {
    let (code, type_name) = match kind {
        Double => (1, None),
        Int64 => (3, None),
        Int32 => (5, None),
        Fixed32 => (7, None),
        Bool => (8, None),
        Text => (9, None),
        Message(name) => (11, Some((*name).to_owned())),
        Bytes => (12, None),
        Enum(name) => (14, Some(format!(".{package}.{message}.{name}"))),
    };
    let label = if *is_repeated { 3 } else { 1 };
    let field = ProtoMessage::new().text(1, name).uint(3, *number).uint(4, label).uint(5, code);
    match type_name {
        Some(type_name) => field.text(6, &type_name),
        None => field,
    }
}

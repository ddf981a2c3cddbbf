"""Foxglove's well-known schemas as JSON schemas, with those of their fields that are filled here.

Nouns: Foxglove schema.
"""

from __future__ import annotations

from typing import Any

Json = dict[str, Any]

NUMBER, TEXT, WHOLE = {"type": "number"}, {"type": "string"}, {"type": "integer"}
FLAG = {"type": "boolean"}
BYTES = {"type": "string", "contentEncoding": "base64"}
TIME = {"title": "time", "type": "object", "properties": {"sec": WHOLE, "nsec": WHOLE}}
DURATION = {**TIME, "title": "duration"}


def _object(title: str, **fields: Json) -> Json:
    return {"title": title, "type": "object", "properties": fields}


def _list(of: Json) -> Json:
    return {"type": "array", "items": of}


VECTOR2 = _object("foxglove.Vector2", x=NUMBER, y=NUMBER)
VECTOR3 = _object("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
POINT3 = _object("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = _object("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
COLOUR = _object("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
POSE = _object("foxglove.Pose", position=VECTOR3, orientation=QUATERNION)
LINE = _object(
    "foxglove.LinePrimitive",
    type=WHOLE,
    pose=POSE,
    thickness=NUMBER,
    scale_invariant=FLAG,
    points=_list(POINT3),
    color=COLOUR,
    colors=_list(COLOUR),
    indices=_list(WHOLE),
)
SPHERE = _object("foxglove.SpherePrimitive", pose=POSE, size=VECTOR3, color=COLOUR)
WORDS = _object(
    "foxglove.TextPrimitive",
    pose=POSE,
    billboard=FLAG,
    font_size=NUMBER,
    scale_invariant=FLAG,
    color=COLOUR,
    text=TEXT,
)
UNUSED = ("arrows", "cubes", "cylinders", "triangles", "models", "metadata")
"""Lists of an entity that stay empty here."""
ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=DURATION,
    frame_locked=FLAG,
    lines=_list(LINE),
    spheres=_list(SPHERE),
    texts=_list(WORDS),
    **{name: _list({"type": "object"}) for name in UNUSED},
)
DELETION = _object("foxglove.SceneEntityDeletion", timestamp=TIME, type=WHOLE, id=TEXT)
FIELD = _object("foxglove.PackedElementField", name=TEXT, offset=WHOLE, type=WHOLE)

SCHEMAS: dict[str, Json] = {
    "FrameTransform": _object(
        "foxglove.FrameTransform",
        timestamp=TIME,
        parent_frame_id=TEXT,
        child_frame_id=TEXT,
        translation=VECTOR3,
        rotation=QUATERNION,
    ),
    "PoseInFrame": _object("foxglove.PoseInFrame", timestamp=TIME, frame_id=TEXT, pose=POSE),
    "LocationFix": _object(
        "foxglove.LocationFix",
        timestamp=TIME,
        frame_id=TEXT,
        latitude=NUMBER,
        longitude=NUMBER,
        altitude=NUMBER,
        position_covariance={**_list(NUMBER), "minItems": 9, "maxItems": 9},
        position_covariance_type=WHOLE,
    ),
    "LaserScan": _object(
        "foxglove.LaserScan",
        timestamp=TIME,
        frame_id=TEXT,
        pose=POSE,
        start_angle=NUMBER,
        end_angle=NUMBER,
        ranges=_list(NUMBER),
        intensities=_list(NUMBER),
    ),
    "Grid": _object(
        "foxglove.Grid",
        timestamp=TIME,
        frame_id=TEXT,
        pose=POSE,
        column_count=WHOLE,
        cell_size=VECTOR2,
        row_stride=WHOLE,
        cell_stride=WHOLE,
        fields=_list(FIELD),
        data=BYTES,
    ),
    "SceneUpdate": _object("foxglove.SceneUpdate", deletions=_list(DELETION), entities=_list(ENTITY)),
    "Log": _object("foxglove.Log", timestamp=TIME, level=WHOLE, message=TEXT, name=TEXT, file=TEXT, line=WHOLE),
}
"""By the name without ``foxglove.``"""

"""The scene of a recording as binary glTF 2.0 with one animation, as Blender imports it.

Layout: Khronos, glTF 2.0 specification (ISO/IEC 12113:2022). Its up axis is y; a root node turns
the world's z to it.
"""

import json
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.export.scene import Body

FLOAT, UNSIGNED_INT, UNSIGNED_BYTE = 5126, 5125, 5121
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
Z_TO_Y = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # xyzw, a quarter turn back about x


class _Buffer:
    """Binary part of the file and the description of the arrays in it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, object]] = []

    def add(self, values: NDArray[np.generic], component: int, *, normalized: bool = False) -> int:
        """Append an array (n,) or (n, k); returns its index."""
        content = np.ascontiguousarray(values)
        width = 1 if content.ndim == 1 else content.shape[1]
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": content.nbytes})
        self.data += content.tobytes() + bytes(-content.nbytes % 4)
        accessor: dict[str, object] = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(content),
            "type": KINDS[width],
        }
        if component == FLOAT:
            flat = content.reshape(len(content), width)
            accessor |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        if normalized:
            accessor["normalized"] = True
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def floats(self, values: NDArray[np.float64]) -> int:
        """Append single-precision numbers."""
        return self.add(values.astype("<f4"), FLOAT)


def write(bodies: list[Body], path: Path) -> None:
    """Write bodies and their motion."""
    buffer = _Buffer()
    nodes: list[dict[str, object]] = [
        {"name": "world", "rotation": Z_TO_Y, "children": list(range(1, len(bodies) + 1))}
    ]
    meshes = []
    channels: list[dict[str, object]] = []
    samplers: list[dict[str, object]] = []
    for k, body in enumerate(bodies):
        meshes.append({"name": body.name, "primitives": [_primitive(buffer, body)]})
        xyzw = np.roll(body.attitude, -1, axis=1)
        node: dict[str, object] = {"name": body.name, "mesh": k}
        node |= {"translation": body.position[0].tolist(), "rotation": xyzw[0].tolist()}
        nodes.append(node)
        if len(body.time) > 1:
            time = buffer.floats(body.time)
            for target, values in (("translation", body.position), ("rotation", xyzw)):
                samplers.append({"input": time, "output": buffer.floats(values)})
                at = {"node": k + 1, "path": target}
                channels.append({"sampler": len(samplers) - 1, "target": at})
    document: dict[str, object] = {
        "asset": {"version": "2.0", "generator": "twin export"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0}, "doubleSided": True}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    if channels:
        document["animations"] = [{"name": "run", "channels": channels, "samplers": samplers}]
    path.write_bytes(_container(json.dumps(document).encode(), bytes(buffer.data)))


def _primitive(buffer: _Buffer, body: Body) -> dict[str, object]:
    attributes = {
        "POSITION": buffer.floats(body.vertices),
        "NORMAL": buffer.floats(body.normals),
        "COLOR_0": buffer.add(body.colors, UNSIGNED_BYTE, normalized=True),
    }
    faces = buffer.add(body.faces.astype("<u4").ravel(), UNSIGNED_INT)
    return {"attributes": attributes, "indices": faces, "material": 0}


def _container(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    parts = [(b"JSON", text), (b"BIN\0", data)]
    body = b"".join(struct.pack("<I", len(c)) + kind + c for kind, c in parts)
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body

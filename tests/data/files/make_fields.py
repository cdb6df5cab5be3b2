#!/usr/bin/python3
"""Makes the small director fields of this folder, byte by byte as VTK, NumPy and open-Qmin write them: 2 x 3 x 4 nodes,
0.2 x 0.3 x 0.4 um apart, the director along (1 + x, 2 - y, 0.5 + z) at node (x, y, z), of order 0.5.
Needs python3-numpy. usage: make_fields.py [FOLDER]"""
import base64
import lzma
import pathlib
import struct
import sys
import zlib

import numpy as np

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else __file__)
folder = folder if folder.is_dir() else folder.resolve().parent
z, y, x = np.mgrid[0:4, 0:3, 0:2]
n = np.stack([1.0 + x, 2.0 - y, 0.5 + z], -1)
n /= np.linalg.norm(n, axis=-1, keepdims=True)
S = 0.5
Q = S * (n[..., :, None] * n[..., None, :] - np.eye(3) / 3)


def lz4_block(data):
    """An LZ4 block of literals alone, as the format allows."""
    length = len(data)
    head = bytes([min(length, 15) << 4])
    if length >= 15:
        rest = length - 15
        head += b"\xff" * (rest // 255) + bytes([rest % 255])
    return head + data


packers = {"vtkZLibDataCompressor": zlib.compress, "vtkLZMADataCompressor": lambda d: lzma.compress(d),
           "vtkLZ4DataCompressor": lz4_block}


def vti(name, array, fmt, kind="Float64", word="UInt32", order="<", compressor="", block=100, encoding="base64"):
    data = array.astype({"Float32": order + "f4", "Float64": order + "f8"}[kind]).tobytes()
    w = order + {"UInt32": "I", "UInt64": "Q"}[word]
    if compressor:
        blocks = [data[i:i + block] for i in range(0, len(data), block)]
        packed = [packers[compressor](b) for b in blocks]
        last = len(blocks[-1]) if len(blocks[-1]) < block else 0
        head = b"".join(struct.pack(w, v) for v in [len(blocks), block, last, *map(len, packed)])
        body = b"".join(packed)
    else:
        head, body = struct.pack(w, len(data)), data
    raw = fmt == "appended" and encoding == "raw"
    coded = head + body if raw else base64.b64encode(head) + base64.b64encode(body) if compressor else base64.b64encode(head + body)
    attributes = f'byte_order="{"LittleEndian" if order == "<" else "BigEndian"}" header_type="{word}"'
    if compressor:
        attributes += f' compressor="{compressor}"'
    head = (f'<?xml version="1.0"?>\n<VTKFile type="ImageData" version="1.0" {attributes}>\n'
            '  <ImageData WholeExtent="0 1 0 2 0 3" Origin="0 0 0" Spacing="0.2 0.3 0.4">\n  <Piece Extent="0 1 0 2 0 3">\n'
            f'    <PointData>\n      <DataArray type="{kind}" Name="n" NumberOfComponents="3" format="{fmt}"').encode()
    tail = b"    </PointData>\n    <CellData>\n    </CellData>\n  </Piece>\n  </ImageData>\n"
    if fmt == "appended":
        out = head + b' offset="0"/>\n' + tail + f'  <AppendedData encoding="{encoding}">\n   _'.encode() + coded
        out += b"\n  </AppendedData>\n</VTKFile>\n"
    else:
        text = " ".join("%.17g" % v for v in array.reshape(-1)).encode() if fmt == "ascii" else coded
        out = head + b">\n        " + text + b"\n      </DataArray>\n" + tail + b"</VTKFile>\n"
    (folder / name).write_bytes(out)


vti("field_ascii.vti", n, "ascii")
for short, compressor in (("zlib", "vtkZLibDataCompressor"), ("lz4", "vtkLZ4DataCompressor"), ("lzma", "vtkLZMADataCompressor")):
    vti(f"field_{short}_inline.vti", n, "binary", compressor=compressor, word="UInt64")
    vti(f"field_{short}_appended.vti", n, "appended", compressor=compressor)
    vti(f"field_{short}_raw.vti", n, "appended", compressor=compressor, encoding="raw", word="UInt64", kind="Float32")
vti("field_one_block.vti", n, "appended", compressor="vtkZLibDataCompressor", block=32768)
vti("field_whole_blocks.vti", n, "binary", compressor="vtkZLibDataCompressor", block=96)  # the last one is as the others
vti("field_big_endian.vti", n, "appended", order=">", encoding="raw")
vti("field_big_endian_zlib.vti", n, "binary", order=">", compressor="vtkZLibDataCompressor", kind="Float32")


def legacy(name, dataset, body, binary):
    head = f"# vtk DataFile Version 3.0\na director field\n{'BINARY' if binary else 'ASCII'}\nDATASET {dataset}\n"
    (folder / name).write_bytes(head.encode() + body)


def numbers(array, binary, letter="d"):
    if binary:
        return np.asarray(array).astype(">f8" if letter == "d" else ">f4").tobytes() + b"\n"
    return ("\n".join(" ".join("%.17g" % v for v in row) for row in np.asarray(array).reshape(-1, 3)) + "\n").encode()


places = np.stack([0.2 * x, 0.3 * y, 0.4 * z], -1)
for binary in (False, True):
    kind = "binary" if binary else "ascii"
    legacy(f"points_{kind}.vtk", "STRUCTURED_POINTS",
           b"DIMENSIONS 2 3 4\nSPACING 0.2 0.3 0.4\nORIGIN 0 0 0\nPOINT_DATA 24\nSCALARS energy double 1\nLOOKUP_TABLE default\n"
           + numbers(np.arange(24.0), binary) + b"VECTORS n double\n" + numbers(n, binary), binary)
    legacy(f"grid_{kind}.vtk", "STRUCTURED_GRID",
           b"DIMENSIONS 2 3 4\nPOINTS 24 float\n" + numbers(places, binary, "f") +
           b"POINT_DATA 24\nFIELD FieldData 2\nlabel 1 24 double\n" + numbers(np.arange(24.0), binary) +
           b"n 3 24 double\n" + numbers(n, binary), binary)
legacy("tensors_ascii.vtk", "STRUCTURED_POINTS",
       b"DIMENSIONS 2 3 4\nSPACING 0.2 0.3 0.4\nORIGIN 0 0 0\nPOINT_DATA 24\nTENSORS Q double\n" + numbers(Q, False), False)

np.savez(folder / "field_stored.npz", n=n)
np.savez_compressed(folder / "field_deflated.npz", n=n.astype("f4"), S=np.full((4, 3, 2), S), other=np.arange(5.0))
np.savez(folder / "field_masked.npz", n=n, domain_mask=np.ones((4, 3, 2), bool))
z, y, x = np.meshgrid(range(4), range(3), range(2), indexing="ij")
np.save(folder / "field_integers.npy", np.stack([2 + 2 * x, 4 - 2 * y, 1 + 2 * z], -1).astype(">i2"))
np.savez(folder / "field_named.npz", directors=n, other=np.arange(5.0))
np.save(folder / "field_big_endian.npy", n.astype(">f8"))
np.save(folder / "q.npy", Q)
np.save(folder / "q_three_halves_small.npy", 1.5 * Q)
lines = []
for k in range(4):
    for j in range(3):
        for i in range(2):
            q = 1.5 * Q[k, j, i]
            lines.append((k, f"{i}\t{j}\t{k}\t{q[0,0]:.12f}\t{q[0,1]:.12f}\t{q[0,2]:.12f}\t{q[1,1]:.12f}\t{q[1,2]:.12f}\t0\t{S:.6f}"))
# open-Qmin writes the sites of its processes one after the other: not in order.
lines.sort(key=lambda line: line[0] % 2)
(folder / "open_qmin_small.txt").write_text("\n".join(line for _, line in lines) + "\n")

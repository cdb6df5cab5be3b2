#!/usr/bin/python3
"""Makes the small pictures of this folder: as Pillow writes them, and tag by tag where Pillow would not write them so
(as tifffile, ImageJ and camera programs do). Needs python3-numpy and python3-pil. usage: make_pictures.py [FOLDER]"""
import pathlib
import struct
import sys

import numpy as np
from PIL import Image

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else __file__)
folder = folder if folder.is_dir() else folder.resolve().parent


def tiff(name, pages, order="<", tail=b""):
    """pages: [(samples as bytes, {tag: (type, values)})]; strip offset and length are added."""
    sizes = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 12: 8}
    letter = {1: "B", 2: "B", 3: "H", 4: "I", 5: "I", 7: "B", 12: "d"}
    out = bytearray((b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8))
    link = 4
    for samples, tags in pages:
        strip = len(out)
        out += samples + b"\0" * (len(samples) % 2)
        tags = {**tags, 273: (4, [strip]), 279: (4, [len(samples)])}
        values = {}
        for tag, (kind, items) in tags.items():
            items = [ord(c) for c in items] + [0] if isinstance(items, str) else list(items)
            packed = b"".join(struct.pack(order + letter[kind], v) for v in items)
            count = len(packed) // sizes[kind]
            if len(packed) > 4:
                at = len(out)
                out += packed + b"\0" * (len(packed) % 2)
                packed = struct.pack(order + "I", at)
            values[tag] = (kind, count, packed.ljust(4, b"\0"))
        struct.pack_into(order + "I", out, link, len(out))
        out += struct.pack(order + "H", len(tags))
        for tag in sorted(values):
            kind, count, packed = values[tag]
            out += struct.pack(order + "HHI", tag, kind, count) + packed
        link = len(out)
        out += struct.pack(order + "I", 0)
    (folder / name).write_bytes(bytes(out) + tail)


def grey(array, photometric=1, bits=None, sample_format=1, order="<", more=None):
    """One grey page of an array, packed where bits are fewer than the array's own."""
    array = np.asarray(array)
    height, width = array.shape
    if bits in (1, 2, 4, 10, 12, 14):  # packed, most significant bit first, each row from a whole byte on
        rows = [(row[:, None] >> np.arange(bits - 1, -1, -1)) & 1 for row in array.astype(int)]
        data = b"".join(np.packbits(row.reshape(-1).astype(np.uint8)).tobytes() for row in rows)
    else:
        data = array.astype(array.dtype.newbyteorder(order)).tobytes()
    bits = bits or array.dtype.itemsize * 8
    tags = {256: (4, [width]), 257: (4, [height]), 258: (3, [bits]), 259: (3, [1]), 262: (3, [photometric]),
            277: (3, [1]), 278: (4, [height]), 339: (3, [sample_format])}
    return data, {**tags, **(more or {})}


def without(page, *tags):
    return page[0], {tag: value for tag, value in page[1].items() if tag not in tags}


# ---- masks: a disc of 97 of 13 x 17 pixels, odd sizes so that rows end within a byte -------------------------------------
y, x = np.mgrid[0:13, 0:17]
disc = (x - 8) ** 2 + (y - 6) ** 2 <= 31
assert disc.sum() == 97
Image.fromarray(disc).save(folder / "mask_pillow_1bit.tif")  # without BitsPerSample
Image.fromarray(disc).save(folder / "mask_pillow_1bit.png")
Image.fromarray(disc).save(folder / "mask_pillow_1bit.bmp")
Image.fromarray(disc).save(folder / "mask_pillow_group4.tif", compression="group4")
Image.fromarray(np.where(disc, 255, 0).astype(np.uint8)).save(folder / "mask_pillow_8bit.tif")
palette = Image.fromarray(disc.astype(np.uint8), "P")
palette.putpalette([0, 0, 0, 200, 30, 0] + [0] * 762)
palette.save(folder / "mask_pillow_palette.png")
palette.save(folder / "mask_pillow_palette.tif")
tiff("mask_big_endian_1bit.tif", [without(grey(disc, bits=1, order=">"), 258)], ">")
tiff("mask_white_is_zero_1bit.tif", [grey(~disc, 0, bits=1)])  # what is shown white
tiff("mask_imagej_inverting.tif", [grey(np.where(disc, 255, 0).astype(np.uint8), 0)])  # what is stored as 255
tiff("mask_imagej_inverting_16bit.tif", [grey(np.where(disc, 65535, 0).astype(np.uint16), 0)])

# ---- white is zero: the ramp 0 .. top, of 8 x 4 pixels -------------------------------------------------------------------
for bits in (2, 4, 8, 10, 12, 14, 16, 32):
    top = 2**bits - 1
    ramp = np.round(np.linspace(0, 1, 32) * top).astype(np.uint64).reshape(4, 8)
    kind = np.uint8 if bits <= 8 else np.uint16 if bits <= 16 else np.uint32
    stored = (top - ramp).astype(kind)
    tiff(f"white_is_zero_{bits}.tif", [grey(stored, 0, bits if bits in (2, 4, 10, 12, 14) else None)])
tiff("white_is_zero_big_endian_16.tif",
     [grey((65535 - np.arange(32).reshape(4, 8) * 2000).astype(np.uint16), 0, order=">")], ">")
tiff("white_is_zero_float.tif", [grey((1 - np.linspace(0, 1, 32).reshape(4, 8)).astype(np.float32), 0, None, 3)])
tiff("white_is_zero_signed.tif", [grey((-1 - np.arange(32).reshape(4, 8)).astype(np.int16), 0, None, 2)])

# ---- stacks: page k of 8 x 6 pixels holds 100 + k --------------------------------------------------------------------------


def stack(name, count, description):
    tiff(name, [grey(np.full((6, 8), 100 + k, np.uint16), more={270: (2, description)} if k == 0 else None)
                for k in range(count)])


stack("stack_plain.tif", 3, "three pictures")
stack("stack_imagej.tif", 6, "ImageJ=1.54f\nimages=6\nchannels=2\nframes=3\nhyperstack=true\nmode=grayscale\n")
ome = ('<?xml version="1.0" encoding="UTF-8"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"><Image ID="Image:0">'
       '<Pixels ID="Pixels:0" DimensionOrder="XYZTC" Type="uint16" SizeX="8" SizeY="6" SizeZ="2" SizeC="1" SizeT="3">'
       '<Channel ID="Channel:0:0" SamplesPerPixel="1"/>%s</Pixels></Image></OME>')
stack("stack_ome.tif", 6, ome % "<TiffData/>")
stack("stack_ome_by_page.tif", 6, ome % "".join(  # the last first
    f'<TiffData IFD="{5 - k}" FirstC="0" FirstT="{k // 2}" FirstZ="{k % 2}" PlaneCount="1"/>' for k in range(6)))
cut = (folder / "stack_imagej.tif").read_bytes()
(folder / "stack_imagej_cut.tif").write_bytes(cut[:len(cut) // 2])

"""A tracker written with the reference implementation of TraX: the first box moves by a pixel per frame.

Its arguments are the regions and images that it takes.
"""

import sys

import numpy as np
import trax
from trax.server import Server

region, image = sys.argv[1:]
with Server([region], [image], tracker_name="mover") as server:
    frames = 0
    while (request := server.wait()).type != trax.TraxStatus.QUIT:
        given = request.image["color"]
        if request.type == trax.TraxStatus.INITIALIZE:
            frames, start = 0, request.objects[0][0]
            print("started with", given.type(), request.properties.dict(), flush=True)
            if region == "rectangle":
                x, y, w, h = start.bounds()
            elif region == "polygon":
                (x, y), (right, bottom) = start[0], start[2]
                w, h = right - x, bottom - y
            else:
                (x, y), (w, h) = start.offset(), start.size()
        frames += request.type == trax.TraxStatus.FRAME
        if region == "rectangle":
            state = trax.Rectangle.create(x + frames, y, w, h)
        elif region == "polygon":
            state = trax.Polygon.create([(x + frames, y), (x + w + frames, y + h), (x + frames, y + h)])
        else:
            state = trax.Mask.create(np.ones((h, w), np.uint8), x=x + frames, y=y)
        pixel = int(given.array()[0, 0, 0]) if image == "memory" else 128
        server.status([(state, {"confidence": pixel / 256})])

"""Writes the MCAP files of this folder with the Python library `mcap`: 200 samples at 100 Hz on two
topics, in each way that chunks are packed.
"""

import json

from mcap.writer import CompressionType, Writer

for name, packing in [
    ("plain", CompressionType.NONE),
    ("lz4", CompressionType.LZ4),
    ("zstd", CompressionType.ZSTD),
]:
    with open(f"log_{name}.mcap", "wb") as file:
        writer = Writer(file, chunk_size=4096, compression=packing)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b'{"type": "object"}')
        pressures = writer.register_channel("/rig/pressures", "json", schema)
        stroke = writer.register_channel("/rig/stroke", "json", schema)
        other = writer.register_channel("/rig/video", "raw", 0)
        for k in range(200):
            time = 1_795_248_902_000_000_000 + k * 10_000_000
            message = json.dumps({"a": 100 + k / 7, "b": [k]}).encode()
            writer.add_message(pressures, time, message, time)
            writer.add_message(other, time, b"\x00\x01", time)
            message = json.dumps({"x": k * 0.25}).encode()
            writer.add_message(stroke, time, message, time)
        writer.finish()

"""ONNX files of tiny models with constant outputs, written without the package onnx."""

TYPES = {"float32": 1, "uint8": 2, "int64": 7, "float16": 10}


def field(key, value):
    """Return a field of a protobuf message: a number, text or a message."""
    if isinstance(value, int):
        return encode(key << 3) + encode(value)
    content = value.encode() if isinstance(value, str) else value
    return encode(key << 3 | 2) + encode(len(content)) + content


def encode(value):
    return bytes([value]) if value < 128 else bytes([value % 128 + 128]) + encode(value // 128)


def declare(name, kind, shape):
    sizes = b"".join(field(1, field(1 if isinstance(size, int) else 2, size)) for size in shape)
    return field(1, name) + field(2, field(1, field(1, TYPES[kind]) + field(2, sizes)))


def make_model(inputs, outputs, operator="Identity"):
    """Return the file of a model with `inputs` (type and shape by name) and `outputs` (arrays by name)."""
    graph = b"".join(field(11, declare(name, *node)) for name, node in inputs.items()) + field(2, "graph")
    for name, array in outputs.items():
        tensor = b"".join(field(1, size) for size in array.shape) + field(2, TYPES[array.dtype.name])
        graph += field(5, tensor + field(8, name + "_in") + field(9, array.tobytes()))
        graph += field(1, field(1, name + "_in") + field(2, name) + field(4, operator))
        graph += field(12, declare(name, array.dtype.name, array.shape))
    return field(1, 8) + field(7, graph) + field(8, field(2, 17))

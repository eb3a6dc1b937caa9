"""Kinds of tools, one file each; a cell file names its kind by the key `tool.kind`."""

"""What a mission says, as typed values: the grammar, the nodes, what they are wired to."""

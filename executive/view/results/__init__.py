"""Results of fault campaigns and detector evaluations, as text and as JSON values."""

"""Who is who on the table: identity, freshness and fate of every object."""

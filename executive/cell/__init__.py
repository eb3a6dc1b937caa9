"""Parts of a work cell as protocols and values, the typed content of cell files, and display shapes."""

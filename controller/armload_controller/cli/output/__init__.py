"""What commands print and write: tables, notes, JSON documents, files."""

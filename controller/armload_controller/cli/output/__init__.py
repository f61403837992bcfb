"""Output of commands: tables, notes, JSON documents, files."""

"""One reader per format of recordings; `reader_registry` has them all."""

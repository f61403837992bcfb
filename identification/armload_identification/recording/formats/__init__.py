"""One reader per format of recordings; `reader_registry` lists them."""

"""Straight-line C for one chain: expressions, the specialised dynamics, and the text made from them."""

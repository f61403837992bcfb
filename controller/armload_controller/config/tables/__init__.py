"""The tables of a robot's file: their keys, what is checked of them, and what other layers get made from them."""

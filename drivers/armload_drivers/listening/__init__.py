"""An arm under another master, from the frames received on its bus; nothing in here can send."""

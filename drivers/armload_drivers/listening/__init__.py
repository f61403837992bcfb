"""An arm that another master drives, from what is heard on its bus; nothing in here can send."""

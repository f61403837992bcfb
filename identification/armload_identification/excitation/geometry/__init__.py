"""Workspace, collision geometry, and the speed of an arm's points."""

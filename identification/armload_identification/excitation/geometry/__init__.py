"""Workspace, and the speed of an arm's points."""

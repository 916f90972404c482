"""Robots that listen to each other: on a plane."""

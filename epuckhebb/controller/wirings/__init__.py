"""Wirings: one file each, which no other file has to name (`epuckhebb.controller.wiring`)."""

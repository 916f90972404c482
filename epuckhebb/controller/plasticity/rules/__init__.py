"""Plasticity rules: one file each, which no other file has to name (`epuckhebb.controller.plasticity.rule`)."""

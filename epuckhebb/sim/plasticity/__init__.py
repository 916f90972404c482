"""Plasticity: how weights change during a lifetime.

A rule says in which direction each weight goes (`rule.Rule`). By how much is the same for all: N_e = N g max(0.2, F),
the base rate N times the need for plasticity and the live fitness (`update`). Controls change the signs of the updates
(`control`), and the weight change is what is measured of it all (`weight_change`). To add a rule: a file of
`rules/`, or anywhere else: `hebbian.rule=my_rules.py:Oja`.
"""

"""Checks of the readings of a log against its mission: units, signs, scales and the order of quaternions.

A user's log may hold degrees where radians are meant, counts of an encoder that turns the other way, or
quaternions with the scalar last. An estimator is lost with them, or wrong without a word. Here each reading is compared
with evidence that does not depend on it: limits of joints, the model's motion under the recorded inputs, gravity,
declared maxima. Another way of reading is named only where the readings contradict that evidence as they are, and agree
with it in that other way. Where there is no evidence, nothing is reported.
"""

"""Poses of a unicycle from readings of beacons and landmarks at known places, from an unknown start too."""

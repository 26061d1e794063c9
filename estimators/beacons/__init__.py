"""Poses of a unicycle from readings of beacons and landmarks at known or unknown places, from an unknown start too."""

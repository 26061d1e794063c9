"""Adapters that bring the environments of the scenarios to learners of others.

    envs = gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=256, terrain="jacksboro", target=(13320, 11610, 642))
    policy = PPO("MlpPolicy", StableBaselinesEnv(VelocityFlights(envs)))

``velocity`` scales what a flight observes and turns a chosen velocity into an acceleration; ``flights`` wraps
environments of Gymnasium in it, one or many at once. ``boxes`` makes every observation of any scenario a box of
float32, as VecNormalize wants them. ``stable_baselines`` and ``clean_rl`` show many missions at once as those libraries
expect them. Stable-Baselines3 and PyTorch are needed by ``stable_baselines`` alone.
"""

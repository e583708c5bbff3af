"""Which sets of effects explain the readings?"""

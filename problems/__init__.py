"""pymoo problems over the models: variables, objectives, limits, known answers."""

"""Which additional parameters belong in the model of a camera?"""

"""Which physical effect do readings show and the model lack?"""

"""Which one or two effects of the table can stand for a third, and does the search know?"""

"""The report's text, and its printed forms.

``blocks`` has the parts of a document, ``sections`` puts them in order with the sentences between them, ``tables`` makes
tables, ``html`` and ``markdown`` print the document, ``pdf`` prints the page, ``files`` writes it with its figures. This room
imports claims, results, number_format, and of figures what a figure is.
"""

"""The report's text, and its two printed forms.

``blocks`` has the parts of a document, ``sections`` puts them in order with the sentences between them, ``tables`` and
``beyond`` make tables, ``html`` and ``pdf`` print the document. This room imports claims, results and number_format.
"""

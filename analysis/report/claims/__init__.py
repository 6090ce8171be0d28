"""The claims of the paper and of studies: what each says, what runs say of it, and the verdict.

``tests`` has the tests of all claims, ``statements`` the paper's claims as data (``statements.yaml``), ``rows`` the runs that
they are about, ``words`` what is said beside their verdicts, and ``reading`` puts these together; ``evidence`` has the
statistics, and ``verdicts`` the rules. This room imports results, stats and tables.
"""

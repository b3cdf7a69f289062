"""Universal files: a guard for the sets, one module a kind of set, rules that sort them into one data object, and the way back.

Read are datasets 58 (text and binary, every function type), 15, 2411, 82, 2412, 2420 (geometry), 55, 2414 (modes), 151 (header)
and 164 (units); others are ignored, with a note. Every record is read here, by its columns, and every count is checked;
the files that are written, and those read, are compared with pyuff in the tests.

What is taken, in this order unless `want` says otherwise: frequency responses, impulse responses (correlations, and time
functions over a force), records, modes, geometry.
"""

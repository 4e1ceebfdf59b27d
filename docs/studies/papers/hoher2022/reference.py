"""Figures of an independent implementation of the same algorithms: docs/reproductions.md has some in brackets.

They are not the paper's: the report prints pictures only. 100 runs where there is noise; case | method | figures.
"""

FIRST_PATH = (
    "centre [m]", "tilt [deg]", "length [m]", "length bias [m]", "width [m]", "width bias [m]", "GW [m]", "IoU",
    "position [m]",
)  # fmt: skip
SECOND_PATH = ("IoU", "GW [m]")
DRIFT = ("tilt [deg]", "IoU", "GW [m]")

FIRST_FIGURES = """
rectangle, sigma 0.0 | RM printed, 1 sigma | 1.14 27.2 1.59 -1.22 1.04 -0.38 1.59 0.21 1.14
rectangle, sigma 0.0 | RM corrected, 1 sigma | 1.19 14.9 1.93 -1.92 1.14 -1.11 1.64 0.13 1.19
rectangle, sigma 0.0 | RM printed, 2 sigma | 1.14 27.2 3.05 2.27 2.19 1.03 2.08 0.24 1.14
rectangle, sigma 0.0 | RM corrected, 2 sigma | 1.19 14.9 0.99 0.87 0.69 -0.42 1.37 0.25 1.19
rectangle, sigma 0.0 | P I=1 | 1.42 14.8 1.47 1.25 1.75 1.45 1.79 0.32 1.14
rectangle, sigma 0.0 | P I=2 | 0.84 14.8 1.34 1.09 1.37 1.00 1.28 0.47 1.14
rectangle, sigma 0.0 | P I=5 | 0.75 14.8 1.44 1.07 1.47 0.97 1.24 0.49 1.14
rectangle, sigma 0.0 | P I=10 | 0.78 14.8 1.41 0.88 1.72 1.07 1.30 0.46 1.14
rectangle, sigma 0.0 | B I=1 | 0.96 2.8 1.51 1.36 1.77 1.47 1.37 0.48 1.19
rectangle, sigma 0.0 | B I=2 | 0.69 2.8 1.30 1.14 1.32 0.94 1.01 0.58 1.19
rectangle, sigma 0.0 | B I=5 | 0.69 2.8 1.33 1.13 1.36 0.79 1.03 0.54 1.19
rectangle, sigma 0.0 | B I=10 | 0.68 2.8 1.29 1.06 1.34 0.53 1.07 0.47 1.19
rectangle, sigma 0.0 | C I=1 | 0.89 2.8 1.51 1.35 1.52 1.28 1.28 0.51 1.19
rectangle, sigma 0.0 | C I=2 | 0.61 2.8 1.29 1.13 1.06 0.81 0.90 0.62 1.19
rectangle, sigma 0.0 | C I=5 | 0.58 2.8 1.32 1.13 1.03 0.76 0.91 0.61 1.19
rectangle, sigma 0.0 | C I=10 | 0.56 2.8 1.27 1.03 0.98 0.54 0.90 0.57 1.19
rectangle, sigma 0.0 | C33 I=2 | 0.60 2.8 1.35 1.14 0.98 0.73 0.89 0.63 1.19
rectangle, sigma 0.0 | G I=1 | 0.61 2.8 1.46 1.16 0.88 0.56 0.92 0.60 1.19
rectangle, sigma 0.0 | G offset | 0.71 8.0 1.38 1.11 1.13 0.88 1.02 0.58 0.65
rectangle, sigma 0.0 | C offset | 0.69 5.2 1.24 1.10 1.37 1.06 1.03 0.59 0.65
rectangle, sigma 0.0 | C naive | 0.83 41.2 2.08 1.71 3.57 3.28 2.18 0.35 0.83
rectangle, sigma 0.0 | direct I=2 | 0.38 2.8 0.98 0.87 0.67 0.47 0.65 0.68 1.19
rectangle, sigma 0.1 | RM printed, 1 sigma | 1.17 38.2 1.42 -0.64 1.22 0.12 1.66 0.23 1.17
rectangle, sigma 0.1 | RM corrected, 1 sigma | 1.19 14.9 1.92 -1.91 1.11 -1.08 1.63 0.13 1.19
rectangle, sigma 0.1 | RM printed, 2 sigma | 1.17 38.2 4.25 3.41 3.17 2.04 2.65 0.25 1.17
rectangle, sigma 0.1 | RM corrected, 2 sigma | 1.19 14.9 1.00 0.88 0.62 -0.35 1.36 0.25 1.19
rectangle, sigma 0.1 | P I=1 | 1.06 5.4 1.51 1.34 1.87 1.63 1.52 0.41 1.17
rectangle, sigma 0.1 | P I=2 | 0.76 5.4 1.34 1.17 1.44 1.16 1.13 0.53 1.17
rectangle, sigma 0.1 | P I=5 | 0.71 5.4 1.40 1.18 1.40 0.99 1.10 0.54 1.17
rectangle, sigma 0.1 | P I=10 | 0.71 5.4 1.40 1.15 1.36 0.87 1.09 0.52 1.17
rectangle, sigma 0.1 | B I=1 | 0.99 2.9 1.52 1.37 1.88 1.64 1.44 0.46 1.19
rectangle, sigma 0.1 | B I=2 | 0.72 2.9 1.33 1.17 1.42 1.13 1.07 0.57 1.19
rectangle, sigma 0.1 | B I=5 | 0.68 2.9 1.33 1.12 1.34 0.86 1.02 0.56 1.19
rectangle, sigma 0.1 | B I=10 | 0.65 2.9 1.31 1.08 1.26 0.68 1.00 0.54 1.19
rectangle, sigma 0.1 | C I=1 | 0.89 2.9 1.51 1.34 1.54 1.31 1.28 0.50 1.19
rectangle, sigma 0.1 | C I=2 | 0.63 2.9 1.31 1.14 1.11 0.92 0.95 0.61 1.19
rectangle, sigma 0.1 | C I=5 | 0.56 2.9 1.31 1.10 0.97 0.70 0.87 0.62 1.19
rectangle, sigma 0.1 | C I=10 | 0.55 2.9 1.30 1.06 0.92 0.59 0.87 0.60 1.19
rectangle, sigma 0.1 | C33 I=2 | 0.61 2.9 1.37 1.16 1.01 0.81 0.92 0.63 1.19
rectangle, sigma 0.1 | G I=1 | 0.60 2.9 1.46 1.18 0.87 0.65 0.91 0.61 1.19
rectangle, sigma 0.1 | G offset | 0.69 7.6 1.38 1.11 1.12 0.88 1.01 0.58 0.64
rectangle, sigma 0.1 | C offset | 0.71 5.0 1.29 1.14 1.41 1.13 1.08 0.58 0.67
rectangle, sigma 0.1 | C naive | 0.83 41.2 2.09 1.71 3.57 3.28 2.18 0.34 0.83
rectangle, sigma 0.1 | direct I=2 | 0.39 2.9 1.01 0.89 0.69 0.48 0.67 0.68 1.19
rectangle, sigma 0.1 | B without sigma^2 | 0.76 2.9 1.37 1.21 1.53 1.29 1.15 0.55 1.19
rectangle, sigma 0.5 | RM printed, 1 sigma | 1.14 27.5 1.43 -1.03 0.77 0.09 1.50 0.26 1.14
rectangle, sigma 0.5 | RM corrected, 1 sigma | 1.20 15.1 1.76 -1.74 0.60 -0.58 1.51 0.20 1.20
rectangle, sigma 0.5 | RM printed, 2 sigma | 1.14 27.5 3.30 2.64 2.50 1.97 2.23 0.30 1.14
rectangle, sigma 0.5 | RM corrected, 2 sigma | 1.20 15.1 1.30 1.22 0.72 0.65 1.43 0.34 1.20
rectangle, sigma 0.5 | P I=1 | 1.57 14.9 1.49 1.29 2.08 1.84 1.98 0.30 1.14
rectangle, sigma 0.5 | P I=2 | 0.85 14.9 1.22 1.01 1.30 0.90 1.26 0.47 1.14
rectangle, sigma 0.5 | P I=5 | 0.64 14.9 1.29 0.91 1.04 0.12 1.08 0.48 1.14
rectangle, sigma 0.5 | P I=10 | 0.71 14.9 1.41 0.91 1.11 -0.02 1.16 0.43 1.14
rectangle, sigma 0.5 | B I=1 | 1.06 4.5 1.53 1.37 2.06 1.82 1.55 0.44 1.20
rectangle, sigma 0.5 | B I=2 | 0.67 4.5 1.20 1.05 1.28 0.86 0.98 0.60 1.20
rectangle, sigma 0.5 | B I=5 | 0.59 4.5 1.12 0.86 1.03 -0.02 0.89 0.51 1.20
rectangle, sigma 0.5 | B I=10 | 0.65 4.5 1.25 0.92 1.09 -0.17 0.98 0.45 1.20
rectangle, sigma 0.5 | C I=1 | 1.00 4.5 1.56 1.39 1.84 1.61 1.47 0.46 1.20
rectangle, sigma 0.5 | C I=2 | 0.66 4.5 1.28 1.10 1.18 0.99 1.01 0.59 1.20
rectangle, sigma 0.5 | C I=5 | 0.55 4.5 1.30 1.02 0.84 0.53 0.85 0.61 1.20
rectangle, sigma 0.5 | C I=10 | 0.60 4.5 1.36 1.02 0.91 0.32 0.92 0.56 1.20
rectangle, sigma 0.5 | C33 I=2 | 0.64 4.5 1.31 1.11 1.11 0.93 0.99 0.60 1.20
rectangle, sigma 0.5 | G I=1 | 0.56 4.5 1.37 1.09 0.83 0.72 0.88 0.64 1.20
rectangle, sigma 0.5 | G offset | 0.63 6.7 1.31 1.05 1.07 0.87 0.95 0.62 0.60
rectangle, sigma 0.5 | C offset | 0.74 6.3 1.22 1.06 1.46 1.18 1.10 0.57 0.69
rectangle, sigma 0.5 | C naive | 0.87 40.4 1.94 1.56 3.29 3.04 2.08 0.36 0.87
rectangle, sigma 0.5 | direct I=2 | 0.86 4.5 1.99 1.73 1.35 1.12 1.31 0.54 1.20
rectangle, sigma 0.5 | B without sigma^2 | 1.48 4.5 1.26 1.11 4.48 4.33 2.69 0.27 1.20
ellipse, sigma 0.0 | RM corrected, 1 sigma | 1.14 15.2 2.40 -2.37 1.32 -1.31 1.77 0.11 1.14
ellipse, sigma 0.0 | P I=2 | 0.77 15.6 0.47 0.02 0.78 0.49 0.87 0.52 1.13
ellipse, sigma 0.0 | B I=2 | 0.52 2.6 0.34 0.12 0.84 0.48 0.55 0.68 1.14
ellipse, sigma 0.0 | C I=2 | 0.45 2.6 0.36 0.14 0.62 0.38 0.47 0.70 1.14
ellipse, sigma 0.0 | C I=10 | 0.21 2.6 0.26 -0.05 0.19 0.13 0.25 0.83 1.14
ellipse, sigma 0.0 | C33 I=2 | 0.36 2.6 0.29 0.08 0.45 0.24 0.36 0.76 1.14
ellipse, sigma 0.0 | G I=1 | 0.19 2.6 0.19 -0.03 0.15 0.05 0.21 0.85 1.14
ellipse, sigma 0.0 | direct I=2 | 0.15 2.6 0.19 -0.04 0.21 0.15 0.20 0.87 1.14
ellipse, sigma 0.1 | RM corrected, 1 sigma | 1.14 15.3 2.39 -2.36 1.28 -1.27 1.76 0.12 1.14
ellipse, sigma 0.1 | P I=2 | 0.56 5.7 0.34 0.07 0.82 0.44 0.62 0.62 1.12
ellipse, sigma 0.1 | B I=2 | 0.50 2.7 0.31 0.11 0.81 0.43 0.53 0.68 1.14
ellipse, sigma 0.1 | C I=2 | 0.43 2.7 0.33 0.12 0.58 0.35 0.45 0.71 1.14
ellipse, sigma 0.1 | C I=10 | 0.19 2.7 0.24 -0.04 0.18 0.07 0.22 0.85 1.14
ellipse, sigma 0.1 | C33 I=2 | 0.37 2.7 0.30 0.07 0.47 0.24 0.37 0.75 1.14
ellipse, sigma 0.1 | G I=1 | 0.19 2.7 0.20 -0.04 0.15 0.04 0.22 0.85 1.14
ellipse, sigma 0.1 | direct I=2 | 0.17 2.7 0.21 -0.03 0.23 0.16 0.22 0.85 1.14
ellipse, sigma 0.5 | RM corrected, 1 sigma | 1.15 16.2 2.19 -2.16 0.70 -0.69 1.60 0.19 1.15
ellipse, sigma 0.5 | P I=2 | 0.92 15.6 0.65 -0.25 1.27 -0.14 1.19 0.30 1.13
ellipse, sigma 0.5 | B I=2 | 0.69 4.4 0.51 -0.13 1.21 -0.09 0.85 0.45 1.15
ellipse, sigma 0.5 | C I=2 | 0.49 4.4 0.41 -0.03 0.77 0.29 0.56 0.65 1.15
ellipse, sigma 0.5 | C I=10 | 0.44 4.4 0.58 -0.31 0.81 -0.57 0.59 0.55 1.15
ellipse, sigma 0.5 | C33 I=2 | 0.46 4.4 0.40 -0.06 0.70 0.21 0.53 0.66 1.15
ellipse, sigma 0.5 | G I=1 | 0.28 4.4 0.41 -0.23 0.35 -0.15 0.38 0.73 1.15
ellipse, sigma 0.5 | direct I=2 | 0.53 4.4 0.92 0.67 0.82 0.69 0.74 0.60 1.15
tractor, sigma 0.0 | RM corrected, 1 sigma | 1.09 18.2 1.91 -1.89 1.51 -1.47 1.66 0.12 1.09
tractor, sigma 0.0 | P I=2 | 0.82 14.4 1.21 0.99 1.09 0.62 1.17 0.38 1.06
tractor, sigma 0.0 | B I=2 | 0.62 2.6 1.14 0.98 1.03 0.52 0.90 0.49 1.09
tractor, sigma 0.0 | C I=2 | 0.76 2.6 1.40 1.17 0.94 0.84 1.09 0.42 1.09
tractor, sigma 0.0 | C I=10 | 0.79 2.6 1.50 1.09 0.89 0.77 1.06 0.44 1.09
tractor, sigma 0.0 | C33 I=2 | 0.79 2.6 1.54 1.23 0.89 0.80 1.11 0.42 1.09
tractor, sigma 0.0 | G I=1 | 0.82 2.6 1.57 1.14 0.84 0.71 1.08 0.44 1.09
tractor, sigma 0.0 | direct I=2 | 0.44 2.6 1.12 0.71 0.62 -0.11 0.73 0.55 1.09
tractor, sigma 0.1 | RM corrected, 1 sigma | 1.09 18.2 1.90 -1.88 1.48 -1.44 1.65 0.12 1.09
tractor, sigma 0.1 | P I=2 | 0.67 5.1 1.21 1.02 1.02 0.55 0.97 0.45 1.08
tractor, sigma 0.1 | B I=2 | 0.63 2.7 1.18 1.00 1.01 0.55 0.91 0.48 1.09
tractor, sigma 0.1 | C I=2 | 0.76 2.7 1.38 1.17 0.96 0.85 1.09 0.42 1.09
tractor, sigma 0.1 | C I=10 | 0.77 2.7 1.46 1.08 0.85 0.72 1.03 0.45 1.09
tractor, sigma 0.1 | C33 I=2 | 0.78 2.7 1.53 1.23 0.89 0.79 1.11 0.43 1.09
tractor, sigma 0.1 | G I=1 | 0.81 2.7 1.56 1.14 0.83 0.70 1.07 0.44 1.09
tractor, sigma 0.1 | direct I=2 | 0.45 2.7 1.13 0.73 0.62 -0.08 0.74 0.54 1.09
tractor, sigma 0.5 | RM corrected, 1 sigma | 1.10 18.6 1.72 -1.70 0.97 -0.95 1.50 0.20 1.10
tractor, sigma 0.5 | P I=2 | 0.76 14.4 1.02 0.87 0.93 0.13 1.06 0.38 1.06
tractor, sigma 0.5 | B I=2 | 0.59 4.4 1.06 0.91 0.92 0.11 0.85 0.49 1.10
tractor, sigma 0.5 | C I=2 | 0.74 4.4 1.30 1.07 0.91 0.72 1.04 0.44 1.10
tractor, sigma 0.5 | C I=10 | 0.71 4.4 1.38 0.94 0.72 0.31 0.92 0.50 1.10
tractor, sigma 0.5 | C33 I=2 | 0.74 4.4 1.40 1.11 0.85 0.67 1.04 0.44 1.10
tractor, sigma 0.5 | G I=1 | 0.68 4.4 1.32 0.96 0.69 0.43 0.91 0.48 1.10
tractor, sigma 0.5 | direct I=2 | 0.90 4.4 1.86 1.57 1.03 0.62 1.27 0.43 1.10
L, sigma 0.0 | RM corrected, 1 sigma | 1.51 18.7 2.75 -2.69 1.68 -1.63 2.20 0.11 1.51
L, sigma 0.0 | P I=2 | 0.74 12.9 1.54 0.98 1.50 0.32 1.35 0.38 1.46
L, sigma 0.0 | B I=2 | 0.61 2.8 1.32 0.87 1.46 0.27 1.11 0.46 1.51
L, sigma 0.0 | C I=2 | 0.75 2.8 1.48 1.12 1.42 0.46 1.15 0.47 1.51
L, sigma 0.0 | C I=10 | 1.09 2.8 1.85 1.08 1.92 0.40 1.43 0.42 1.51
L, sigma 0.0 | C33 I=2 | 0.82 2.8 1.64 1.16 1.49 0.36 1.23 0.46 1.51
L, sigma 0.0 | G I=1 | 1.04 2.8 1.91 1.08 1.68 0.20 1.44 0.42 1.51
L, sigma 0.0 | direct I=2 | 0.70 2.8 1.38 0.38 1.09 -0.18 1.06 0.49 1.51
L, sigma 0.1 | RM corrected, 1 sigma | 1.51 18.7 2.74 -2.68 1.64 -1.58 2.19 0.11 1.51
L, sigma 0.1 | P I=2 | 0.63 4.3 1.41 0.98 1.34 0.42 1.09 0.45 1.50
L, sigma 0.1 | B I=2 | 0.60 2.9 1.36 0.95 1.35 0.41 1.06 0.49 1.51
L, sigma 0.1 | C I=2 | 0.74 2.9 1.51 1.15 1.35 0.58 1.11 0.48 1.51
L, sigma 0.1 | C I=10 | 1.10 2.9 1.89 1.08 1.87 0.46 1.41 0.45 1.51
L, sigma 0.1 | C33 I=2 | 0.80 2.9 1.65 1.17 1.40 0.48 1.18 0.48 1.51
L, sigma 0.1 | G I=1 | 1.00 2.9 1.89 1.08 1.57 0.29 1.37 0.46 1.51
L, sigma 0.1 | direct I=2 | 0.71 2.9 1.38 0.40 1.11 -0.16 1.07 0.49 1.51
L, sigma 0.5 | RM corrected, 1 sigma | 1.51 18.9 2.59 -2.54 1.13 -1.10 2.05 0.17 1.51
L, sigma 0.5 | P I=2 | 0.68 12.9 1.24 0.91 0.98 0.19 1.13 0.41 1.46
L, sigma 0.5 | B I=2 | 0.53 4.4 1.15 0.88 0.98 0.13 0.89 0.50 1.51
L, sigma 0.5 | C I=2 | 0.70 4.4 1.44 1.09 1.18 0.73 1.05 0.47 1.51
L, sigma 0.5 | C I=10 | 1.09 4.4 1.77 0.85 1.87 0.13 1.47 0.39 1.51
L, sigma 0.5 | C33 I=2 | 0.73 4.4 1.56 1.13 1.18 0.67 1.08 0.47 1.51
L, sigma 0.5 | G I=1 | 0.71 4.4 1.46 0.81 1.11 0.27 1.03 0.50 1.51
L, sigma 0.5 | direct I=2 | 0.99 4.4 2.00 1.31 1.62 0.48 1.39 0.44 1.51
"""

SECOND_FIGURES = """
second path, rectangle, sigma 0.0 | RM corrected, 1 sigma | 0.14 1.58
second path, rectangle, sigma 0.0 | P I=2 | 0.40 1.48
second path, rectangle, sigma 0.0 | B I=2 | 0.58 0.94
second path, rectangle, sigma 0.0 | C I=2 | 0.59 0.94
second path, rectangle, sigma 0.0 | C I=10 | 0.60 0.81
second path, rectangle, sigma 0.0 | C33 I=2 | 0.61 0.89
second path, rectangle, sigma 0.0 | G I=1 | 0.59 0.90
second path, rectangle, sigma 0.0 | G offset | 0.57 0.96
second path, rectangle, sigma 0.0 | C naive | 0.39 1.89
second path, rectangle, sigma 0.0 | direct I=2 | 0.70 0.62
second path, rectangle, sigma 0.1 | RM corrected, 1 sigma | 0.14 1.57
second path, rectangle, sigma 0.1 | P I=2 | 0.49 1.16
second path, rectangle, sigma 0.1 | B I=2 | 0.56 1.04
second path, rectangle, sigma 0.1 | C I=2 | 0.58 0.97
second path, rectangle, sigma 0.1 | C I=10 | 0.63 0.81
second path, rectangle, sigma 0.1 | C33 I=2 | 0.61 0.92
second path, rectangle, sigma 0.1 | G I=1 | 0.60 0.88
second path, rectangle, sigma 0.1 | G offset | 0.58 0.95
second path, rectangle, sigma 0.1 | C naive | 0.39 1.88
second path, rectangle, sigma 0.1 | direct I=2 | 0.69 0.63
second path, rectangle, sigma 0.1 | B without sigma^2 | 0.54 1.11
second path, rectangle, sigma 0.5 | RM corrected, 1 sigma | 0.21 1.45
second path, rectangle, sigma 0.5 | P I=2 | 0.41 1.42
second path, rectangle, sigma 0.5 | B I=2 | 0.59 0.96
second path, rectangle, sigma 0.5 | C I=2 | 0.56 1.04
second path, rectangle, sigma 0.5 | C I=10 | 0.55 0.88
second path, rectangle, sigma 0.5 | C33 I=2 | 0.58 1.00
second path, rectangle, sigma 0.5 | G I=1 | 0.64 0.81
second path, rectangle, sigma 0.5 | G offset | 0.62 0.86
second path, rectangle, sigma 0.5 | C naive | 0.41 1.71
second path, rectangle, sigma 0.5 | direct I=2 | 0.57 1.13
second path, rectangle, sigma 0.5 | B without sigma^2 | 0.29 2.46
second path, ellipse, sigma 0.0 | RM corrected, 1 sigma | 0.13 1.72
second path, ellipse, sigma 0.0 | P I=2 | 0.41 1.21
second path, ellipse, sigma 0.0 | B I=2 | 0.61 0.68
second path, ellipse, sigma 0.0 | C I=2 | 0.64 0.59
second path, ellipse, sigma 0.0 | C I=10 | 0.81 0.28
second path, ellipse, sigma 0.0 | C33 I=2 | 0.68 0.50
second path, ellipse, sigma 0.0 | G I=1 | 0.83 0.26
second path, ellipse, sigma 0.0 | G offset | 0.82 0.27
second path, ellipse, sigma 0.0 | C naive | 0.43 1.25
second path, ellipse, sigma 0.0 | direct I=2 | 0.82 0.27
second path, ellipse, sigma 0.1 | RM corrected, 1 sigma | 0.13 1.71
second path, ellipse, sigma 0.1 | P I=2 | 0.53 0.80
second path, ellipse, sigma 0.1 | B I=2 | 0.61 0.67
second path, ellipse, sigma 0.1 | C I=2 | 0.63 0.60
second path, ellipse, sigma 0.1 | C I=10 | 0.83 0.25
second path, ellipse, sigma 0.1 | C33 I=2 | 0.67 0.51
second path, ellipse, sigma 0.1 | G I=1 | 0.82 0.26
second path, ellipse, sigma 0.1 | G offset | 0.81 0.28
second path, ellipse, sigma 0.1 | C naive | 0.43 1.25
second path, ellipse, sigma 0.1 | direct I=2 | 0.81 0.29
second path, ellipse, sigma 0.1 | B without sigma^2 | 0.61 0.69
second path, ellipse, sigma 0.5 | RM corrected, 1 sigma | 0.21 1.56
second path, ellipse, sigma 0.5 | P I=2 | 0.21 1.54
second path, ellipse, sigma 0.5 | B I=2 | 0.36 1.02
second path, ellipse, sigma 0.5 | C I=2 | 0.57 0.71
second path, ellipse, sigma 0.5 | C I=10 | 0.48 0.68
second path, ellipse, sigma 0.5 | C33 I=2 | 0.58 0.68
second path, ellipse, sigma 0.5 | G I=1 | 0.69 0.43
second path, ellipse, sigma 0.5 | G offset | 0.67 0.46
second path, ellipse, sigma 0.5 | C naive | 0.43 1.21
second path, ellipse, sigma 0.5 | direct I=2 | 0.60 0.69
second path, ellipse, sigma 0.5 | B without sigma^2 | 0.30 2.08
"""

DRIFT_FIGURES = """
drift, ellipse, sigma 0.0 | C I=10 | 21.4 0.45 1.34
drift, ellipse, sigma 0.0 | square root I=2 | 15.2 0.55 1.40
drift, ellipse, sigma 0.0 | square root I=10 | 8.7 0.72 0.65
drift, ellipse, sigma 0.0 | abc I=10 | 24.3 0.42 2.72
drift, ellipse, sigma 0.0 | abc gain 10 I=10 | 9.5 0.73 0.65
drift, ellipse, sigma 0.1 | C I=10 | 21.4 0.47 1.24
drift, ellipse, sigma 0.1 | square root I=2 | 15.3 0.55 1.34
drift, ellipse, sigma 0.1 | square root I=10 | 8.6 0.72 0.63
drift, ellipse, sigma 0.1 | abc I=10 | 24.9 0.42 2.80
drift, ellipse, sigma 0.1 | abc gain 10 I=10 | 8.5 0.74 0.58
drift, ellipse, sigma 0.5 | C I=10 | 21.7 0.45 1.24
drift, ellipse, sigma 0.5 | square root I=2 | 18.7 0.51 1.53
drift, ellipse, sigma 0.5 | square root I=10 | 19.2 0.34 1.25
drift, ellipse, sigma 0.5 | abc I=10 | 25.9 0.45 2.57
drift, ellipse, sigma 0.5 | abc gain 10 I=10 | 18.4 0.42 1.01
drift, rectangle, sigma 0.0 | C I=10 | 21.2 0.41 1.70
drift, rectangle, sigma 0.0 | square root I=2 | 15.2 0.47 1.66
drift, rectangle, sigma 0.0 | square root I=10 | 10.7 0.54 1.34
drift, rectangle, sigma 0.0 | abc I=10 | 21.2 0.36 2.61
drift, rectangle, sigma 0.0 | abc gain 10 I=10 | 11.0 0.50 1.89
drift, rectangle, sigma 0.1 | C I=10 | 21.2 0.41 1.68
drift, rectangle, sigma 0.1 | square root I=2 | 15.4 0.45 1.75
drift, rectangle, sigma 0.1 | square root I=10 | 11.0 0.55 1.43
drift, rectangle, sigma 0.1 | abc I=10 | 21.3 0.36 2.60
drift, rectangle, sigma 0.1 | abc gain 10 I=10 | 10.5 0.51 1.79
drift, rectangle, sigma 0.5 | C I=10 | 21.5 0.43 1.58
drift, rectangle, sigma 0.5 | square root I=2 | 16.9 0.46 1.71
drift, rectangle, sigma 0.5 | square root I=10 | 10.1 0.54 1.19
drift, rectangle, sigma 0.5 | abc I=10 | 21.6 0.38 2.47
drift, rectangle, sigma 0.5 | abc gain 10 I=10 | 10.8 0.49 1.35
"""


def parse(text: str, columns: tuple[str, ...]) -> dict[tuple[str, str], dict[str, float]]:
    """(case, method) -> column -> figure."""
    table = {}
    for line in text.strip().splitlines():
        case, method, figures = (part.strip() for part in line.split("|"))
        table[case, method] = dict(zip(columns, map(float, figures.split()), strict=True))
    return table


REFERENCE = {
    **parse(FIRST_FIGURES, FIRST_PATH),
    **parse(SECOND_FIGURES, SECOND_PATH),
    **parse(DRIFT_FIGURES, DRIFT),
}

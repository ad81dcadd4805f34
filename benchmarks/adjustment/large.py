"""One large network in a process of its own: seconds, and the largest memory that it took.

    OPENBLAS_NUM_THREADS=2 python benchmarks/adjustment/large.py network.npz

Prints one line of JSON. The adjustment and the covariance of each point (3 x 3) are the public
calls; the memory is that of the whole process, the interpreter and the observations with it.
"""

import json
import resource
import sys
import time

import numpy as np
import problems

from tankcal.survey.network import adjust


def main():
    """Adjust the network of a file and print what it took."""
    survey = problems.tank(dict(np.load(sys.argv[1])))
    begin = time.process_time()
    adjusted = adjust(survey)
    solved = time.process_time()
    blocks = adjusted.point_covariances_m2
    done = time.process_time()
    found = {
        "photos": len(survey.photos.names),
        "points": len(survey.points),
        "equations": adjusted.solution.rows,
        "iterations": adjusted.solution.iterations,
        "solve_s": solved - begin,
        "covariances_s": done - solved,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "sigma0": adjusted.sigma0,
        "trace_m2": float(np.einsum("nii->", blocks)),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()

"""rnx2rtkp of RTKLIB demo5, as far as `cargo xtask peers` needs it."""

import argparse
import sys

import pyrtklib5 as rtklib

parser = argparse.ArgumentParser()
parser.add_argument("-k", dest="options", required=True)
parser.add_argument("-o", dest="output", required=True)
parser.add_argument("files", nargs="+")
arguments = parser.parse_args()

rtklib.resetsysopts()
if not rtklib.loadopts(arguments.options, rtklib.sysopts[0]):
    sys.exit(f"{arguments.options}: cannot be read")
processing, solution, other = rtklib.prcopt_t(), rtklib.solopt_t(), rtklib.filopt_t()
rtklib.getsysopts(processing, solution, other)
start = end = rtklib.gtime_t()
files = arguments.files
sys.exit(rtklib.postpos(start, end, 0.0, 0.0, processing, solution, other, files, len(files), arguments.output, "", ""))

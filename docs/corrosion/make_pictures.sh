#!/usr/bin/env bash
# Makes the pictures of docs/corrosion.md anew: make_pictures.sh [SCATTER]
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
scatter="${1:-scatter}"
images="$here/../images/corrosion"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir -p "$images"

python3 "$here/make_maps.py" "$work/maps"
corrode() { "$scatter" corrode --seed 1 "$@" >/dev/null; }

# The three scenes of the thesis.
corrode -o "$work/plate" --size 448 --age 25 --corrosivity medium --starting-points 30 \
  --surface "$work/maps/plate_surface.png" --material "$work/maps/plate_material.png"
corrode -o "$work/pipe" --size 384 --age 95 --corrosivity high --starting-points 300 --thickness-mm 4 --layer-depths 2500,800,5 \
  --surface "$work/maps/pipe_surface.png" --material "$work/maps/pipe_material.png" --layer3 "$work/maps/pipe_layer3.png"
corrode -o "$work/tube" --size 512 --age 90 --corrosivity very-high --starting-points 100 --thickness-mm 25 --extent-mm 100 \
  --depth-per-spread 0.6 --layer-depths 15000,5000,5 \
  --surface "$work/maps/tube_surface.png" --material "$work/maps/tube_material.png" \
  --opening "$work/maps/tube_opening.png" --bump "$work/maps/tube_opening.png" \
  --layer0 "$work/maps/tube_layer0.png" --layer1 "$work/maps/tube_layer1.png" \
  --layer2 "$work/maps/tube_layer2.png" --layer3 "$work/maps/tube_layer3.png"
for scene in plate pipe tube; do
  cp "$work/$scene/preview.png" "$images/$scene.png"
done
cp "$work/plate/regime.png" "$images/plate_regime.png"

# Its two rows of spheres as flat sheets, in both modes.
corrode -o "$work/ages" --size 512 --series 1,5,10,15,20 --corrosivity low --starting-points 20
cp "$work/ages/strip.png" "$images/ages.png"
corrode -o "$work/thesis_ages" --series 1,5,10,15,20 --corrosivity low --starting-points 20 --mode thesis --size 256
cp "$work/thesis_ages/strip.png" "$images/thesis_ages.png"
row=()
for points in 10 30 50 100 150; do
  corrode -o "$work/points_$points" --age 1 --corrosivity low --starting-points "$points" --size 220
  row+=("$work/points_$points/preview.png")
done
python3 "$here/arrange.py" row "$images/points.png" "${row[@]}"

# Eight times as large, and twice across and down.
python3 "$here/arrange.py" zoom "$images/zoom.png" "$work/ages/age-20/preview.png" 60 190 64 8
corrode -o "$work/tile" --age 10 --corrosivity low --starting-points 20 --size 220
python3 "$here/arrange.py" tile "$images/tile.png" "$work/tile/preview.png"

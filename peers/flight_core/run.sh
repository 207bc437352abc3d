#!/bin/sh
# An exported diagnosis on a simulated flight-class core: sh peers/flight_core/run.sh EXPORT [SECONDS]
# Compiles the export for this machine, a Cortex-M4F (double in software) and a Cortex-M7 (double in hardware), runs the
# same random samples on all three, and compares everything they say. Installs the compiler and the simulator (Debian; needs
# the right to install packages).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
export_folder=$(cd "$1" && pwd)
seconds=${2:-60}
"$here/../need" arm-none-eabi-gcc=gcc-arm-none-eabi,libnewlib-arm-none-eabi qemu-system-arm=qemu-system-arm
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
flags="-std=c99 -Wall -Wextra -Wconversion -Werror -O2 -ffp-contract=off -I$export_folder"
sources="$export_folder/servotwin_*.c $here/core.c"
# shellcheck disable=SC2086 # words are split on purpose, here and below
cc $flags -o host $sources "$here/host.c" -lm
for core in "cortex-m4 -mfpu=fpv4-sp-d16" "cortex-m7 -mfpu=fpv5-d16"; do
    set -- $core
    # Doubles in software need sums that are rounded correctly.
    own=
    if [ "$1" = cortex-m4 ]; then own="$here/soft_double.c -Wl,-z,muldefs"; fi
    arm-none-eabi-gcc -mcpu="$1" -mthumb "$2" -mfloat-abi=hard -fno-math-errno $flags --specs=nosys.specs -nostartfiles \
        -T "$here/cortex_m.ld" -o "$1.elf" $sources "$here/cortex_m.c" $own -lm
    arm-none-eabi-size "$1.elf" | tail -1 | awk -v core="$1" '{ print core ": " $1 " bytes of code and constants, " $3 " of state" }'
done
status=0
python3 "$here/samples.py" "$export_folder" "$seconds" > samples.bin
./host < samples.bin > host.txt
tail -1 host.txt
for core in "cortex-m4 mps2-an386" "cortex-m7 mps2-an500"; do
    set -- $core
    qemu-system-arm -M "$2" -nographic -icount shift=0 -semihosting-config enable=on,target=native -kernel "$1.elf" \
        < /dev/null > "$1.txt" 2>&1
    grep instructions "$1.txt" || cat "$1.txt"
    if grep -v instructions "$1.txt" | cmp -s - host.txt; then
        echo "$1: the same bits as on this machine in all samples"
    else
        echo "$1: OTHER BITS"
        status=1
    fi
done
exit $status

# judge.sh BIN STUDY TUNE DIAGDIR LOG
cd /tmp/t; (time TUNE="$3" DIAG=$4/diagnoser-realistic.json taskset -c 1 ./$1 -q flights --full --setting realistic $2.toml --out j$2 --threads 1) > $5 2>&1

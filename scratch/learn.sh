# learn.sh BIN STUDY
cd /tmp/t; (time ONLY_LEARN=1 taskset -c 1 ./$1 -q flights --full --setting realistic $2.toml --out $2 --threads 1) > $2.learn.log 2>&1

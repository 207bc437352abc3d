# gen NAME SEED LEARN JUDGE [violent]
sed -e "s/^\[flights\]/[flights]\nseed = $2/" -e "s/^full.learn = .*/full.learn = { $3 }/" -e "s/^full.judge = .*/full.judge = { $4 }/" /work/wt-flights/studies/paper.toml > /tmp/t/$1.toml
if [ -n "$5" ]; then python3 - /tmp/t/$1.toml <<'P'
import sys,re
p=sys.argv[1]; s=open(p).read()
i=s.index('[flights]'); a=s.index('commands = [',i); b=s.index(']\ninputs',a)
s=s[:a]+'''commands = [
    "noise:rms={3..5}deg,bandwidth={1..2}Hz,seed=4{n}",
    "step:size={6..9}deg,at={1..4}s + step:size=-{9..14}deg,at={8..11}s + step:size={4..6}deg,at={13..16}s",
'''+s[b:]
open(p,'w').write(s)
P
fi

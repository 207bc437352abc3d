import json,os,sys
src,dst=sys.argv[1:3]
d=json.load(open(f'/tmp/t/{src}/diagnoser-realistic.json'))
for kv in sys.argv[3:]:
    k,v=kv.split('='); v=float(v)
    if k=='others': d['decision']['costs']['same_actuator'][0]=[1.0,10.0,v,v]
    elif k=='wrong': d['decision']['costs']['other_actuator'][0]=v
    else: assert k in d['decision']; d['decision'][k]=v
print([(l.get('relative'),l['panel'].get('least_confidence')) for l in d['lengths']])
os.makedirs(f'/tmp/t/{dst}',exist_ok=True); json.dump(d,open(f'/tmp/t/{dst}/diagnoser-realistic.json','w'))

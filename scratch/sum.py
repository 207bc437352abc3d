import re,sys
rows=[]
for l in open(sys.argv[1]):
    m=re.match(r'MOST (\d+) env (\d+) (.*)',l)
    if m: rows.append((int(m[1]),int(m[2]),m[3].split()))
    if l.startswith('TUNE') or (l.startswith('LATE') and len(sys.argv)>2): print(l.strip())
if rows:
    n=len(rows[0][2])//2
    print(len(rows),'flights')
    for s in range(n):
        for k,name in ((0,'other'),(1,'off')):
            v=sorted(((float(r[2][2*s+k].split('@')[0]),r[2][2*s+k],r[0],r[1]) for r in rows),reverse=True)
            c=[sum(a[0]>=x for a in v) for x in (.2,.3,.45,.7,1)]
            e=len({a[3] for a in v if a[0]>=.45})
            print(s,name,'>=.2,.3,.45,.7,1:',c,'envs>=.45',e,' '.join(f'{a[1]}#e{a[3]}' for a in v[:6]))

import re,sys
rows=[]; n=0
for l in open(sys.argv[1]):
    if l.startswith('MOST'):
        m=re.match(r'MOST (\d+) env (\d+) (.*)',l); f=int(m[1]);e=int(m[2]); parts=m[3].split(); n=len(parts)//2
        rows.append((f,e,parts))
    if l.startswith('TUNE'): print(l.strip())
for s in range(n):
    for k,name in ((0,'other'),(1,'off')):
        v=sorted(((float(r[2][2*s+k].split('@')[0]),r[2][2*s+k],r[0],r[1]%6) for r in rows),reverse=True)[:7]
        print(s,name,' '.join(f'{a[1]}#{a[2]}/{a[3]}' for a in v))

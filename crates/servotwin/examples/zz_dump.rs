use servotwin::system::System;
use servotwin_model::{kernel_source, solver::Settings};
fn main(){ let s=System::default(); let p=&s.program;
 if std::env::args().count()>1 {
  let par=p.parameters(&[]);
  let c=p.block_constants(&par); let g=p.first_guess(&par); let st=p.stand_in_values(&par);
  println!("{} {} {} {} {}", c.len(), p.memory(), p.rows().slots(), p.plan().slots(), p.states().len());
  let mut v=vec![0.0;p.memory()]; v[..g.len()].copy_from_slice(&g);
  for (i,x) in p.network().inputs.iter().enumerate(){ v[p.externals().start+i]=x.default; }
  for (i,x) in st.iter().enumerate(){ v[p.externals().end+i]=*x; }
  for x in c {println!("{x:e}");} for x in v {println!("{x:e}");}
  return; }
 print!("{}", kernel_source::write(p, Settings::campaign().method).unwrap()); }

//! Scratch, never committed.
use servotwin::system::System;
use servotwin_model::solver::Method;
fn main() {
    let out = std::path::PathBuf::from(std::env::args().nth(1).unwrap());
    std::fs::create_dir_all(&out).unwrap();
    for path in std::env::args().skip(2) {
        let name = std::path::Path::new(&path).file_stem().unwrap().to_string_lossy().into_owned();
        let Ok(system) = System::read(&path) else {
            println!("not {path}");
            continue;
        };
        let p = &system.program;
        let put = |kind: &str, text: String| {
            std::fs::write(out.join(format!("{name}_{kind}.c")), text).unwrap()
        };
        put("none", servotwin_model::c_source::write_equations(p, "t", &[]).unwrap());
        put(
            "all",
            servotwin_model::c_source::write_equations(p, "model", p.observables()).unwrap(),
        );
        for m in Method::ALL {
            if let Some(t) = servotwin_model::c_source::write_step(p, m) {
                put(m.name(), t);
            }
        }
        println!(
            "{name}: states {} externals {} memory {} constants {} jacobian {} lu {}",
            p.states().len(),
            p.externals().len(),
            p.memory(),
            p.constants(),
            p.jacobian().slots(),
            p.lu().slots()
        );
    }
}

fn main() {
    for c in servotwin_model::components::ALL {
        println!("{:#?}", c.spec());
    }
}

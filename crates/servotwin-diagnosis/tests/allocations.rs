//! A session allocates nothing after it was made. A binary of its own, because it counts for all
//! of the process.

use servotwin_diagnosis::diagnoser::{IndexedFinding, Session};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

#[allow(dead_code)]
mod toy;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: everything is the system's allocator's; a counter is not memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> u64 {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn a_session_allocates_nothing_at_work() {
    assert!(allocations(|| drop(Vec::<u8>::with_capacity(100))) > 0, "the counter counts");
    let mut session = Session::new(toy::with_baseline().into()).unwrap();
    let mut flight = toy::Flight::new(1000);
    let fault = toy::Fault { actuator: 1, kind: toy::Kind::Leak, size: 0.8 };
    let count = allocations(|| {
        for k in 0..6000_u64 {
            let (mut inputs, mut measured, twin) = flight.next((k > 1000).then_some(fault));
            match k {
                400..450 => inputs[0] = f64::NAN,
                600..650 => measured[3] = f64::NAN,
                700..750 => measured[3] = f64::INFINITY,
                3000 => session.take_out(2, true).unwrap(),
                3500 => session.switched_off(1).unwrap(),
                4000 => session.reset(),
                _ => {}
            }
            session.push(&inputs, &measured, &twin);
        }
    });
    assert_eq!(count, 0);
    let finding = session.outcome().finding;
    assert!(
        matches!(finding, IndexedFinding::Detail { actuator: 1, action: 0, .. }),
        "{finding:?}"
    );
}

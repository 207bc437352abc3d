//! The server as its viewers meet it.

mod live;
mod measured;
mod page;
mod viewer;

//! Where something stands in an array, in a form that needs no arithmetic.
//!
//! Half of what a step reads it finds through lists of places. Processors multiply
//! an address' offset by up to eight for nothing, but lanes are up to 128 bytes long;
//! so a place holds sixteen times the index.

/// The index of a variable in the array of all.
pub type Slot = u16;

/// A place in an array of lanes of any width, or of single numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LaneOffset(u32);

/// What a place is for every index.
const STEP: u32 = 16;

impl LaneOffset {
    /// The place of an index.
    pub const fn new(index: Slot) -> Self {
        Self(index as u32 * STEP)
    }

    /// The index.
    pub fn index(self) -> usize {
        (self.0 / STEP) as usize
    }

    /// The element in this place of an array that begins at `first`.
    ///
    /// # Safety
    /// The array must have the place.
    #[inline(always)]
    pub unsafe fn among<T>(self, first: *mut T) -> *mut T {
        // SAFETY: promised by the caller.
        unsafe {
            if size_of::<T>().is_multiple_of(STEP as usize) {
                first.byte_add(self.0 as usize * (size_of::<T>() / STEP as usize))
            } else {
                first.add(self.index())
            }
        }
    }

    /// What stands in this place.
    ///
    /// # Safety
    /// The array must have the place.
    #[inline(always)]
    pub unsafe fn read<T: Copy>(self, array: &[T]) -> T {
        debug_assert!(self.index() < array.len());
        // SAFETY: promised by the caller.
        unsafe { *self.among(array.as_ptr().cast_mut()) }
    }
}

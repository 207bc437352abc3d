//! The offset of an element in an array, in a form that needs no arithmetic.
//!
//! A step finds half of its operands through lists of offsets. Processors scale an
//! index by up to eight for free, but lanes are up to 64 bytes long. A lane offset
//! therefore stores eight times the index.

/// The index of a variable in the array of all variables.
pub type Slot = u16;

/// An offset into an array of lanes of any width, or of single numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LaneOffset(u32);

/// The offset per index.
const STEP: u32 = 8;

impl LaneOffset {
    /// The offset of an index.
    pub(crate) const fn new(index: Slot) -> Self {
        Self(index as u32 * STEP)
    }

    /// The index of the offset.
    pub(crate) fn index(self) -> usize {
        (self.0 / STEP) as usize
    }

    /// The element at this offset in an array that begins at `first`.
    ///
    /// # Safety
    /// The offset must lie within the array.
    #[inline(always)]
    pub(crate) unsafe fn among<T>(self, first: *mut T) -> *mut T {
        // SAFETY: promised by the caller.
        unsafe {
            if size_of::<T>().is_multiple_of(STEP as usize) {
                first.byte_add(self.0 as usize * (size_of::<T>() / STEP as usize))
            } else {
                first.add(self.index())
            }
        }
    }

    /// Reads the element at this offset.
    ///
    /// # Safety
    /// The offset must lie within the array.
    #[inline(always)]
    pub(crate) unsafe fn read<T: Copy>(self, array: &[T]) -> T {
        debug_assert!(self.index() < array.len());
        // SAFETY: promised by the caller.
        unsafe { *self.among(array.as_ptr().cast_mut()) }
    }
}

//! Where something stands in an array, in a form that needs no arithmetic.
//!
//! Half of what a step reads it finds through lists of places. Processors multiply
//! an address' offset by up to eight for nothing, but lanes are up to 64 bytes long;
//! so a place holds eight times the index.

/// A place in an array of lanes of any width, or of single numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place(u32);

impl Place {
    /// The place of an index.
    pub fn new(index: impl Into<u32>) -> Self {
        Self(index.into() * 8)
    }

    /// The index.
    pub fn index(self) -> usize {
        (self.0 / 8) as usize
    }

    /// The same place in an array whose elements are as far apart as `T` is long.
    ///
    /// # Safety
    /// The array must have the place.
    #[inline(always)]
    pub unsafe fn among<T, E>(self, first: *mut E) -> *mut E {
        const { assert!(size_of::<T>().is_multiple_of(8)) };
        // SAFETY: promised by the caller.
        unsafe { first.byte_add(self.0 as usize * (size_of::<T>() / 8)) }
    }

    /// The element in this place.
    ///
    /// # Safety
    /// The array must have the place.
    #[inline(always)]
    pub unsafe fn read<T: Copy>(self, array: &[T]) -> T {
        debug_assert!(self.index() < array.len());
        // SAFETY: promised by the caller.
        unsafe { *self.among::<T, T>(array.as_ptr().cast_mut()) }
    }
}

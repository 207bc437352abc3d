//! Decompression of Zstandard pages, which other writers often use; ours does not.
//!
//! The Parquet library's own codec is C code that takes longer to compile than the library. So the library reads such
//! pages as uncompressed, and a decoder in Rust decompresses them here.

use std::io::Read;

use ::parquet::basic::Compression;
use ::parquet::column::page::{Page, PageMetadata, PageReader};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::ColumnChunkMetaData;
use ruzstd::decoding::StreamingDecoder;

/// Whether a column is compressed with Zstandard.
pub(super) fn is_packed(chunk: &ColumnChunkMetaData) -> bool {
    matches!(chunk.compression(), Compression::ZSTD(_))
}

/// The column's description, declared as uncompressed.
pub(super) fn as_stored(chunk: &ColumnChunkMetaData) -> Result<ColumnChunkMetaData, ParquetError> {
    chunk.clone().into_builder().set_compression(Compression::UNCOMPRESSED).build()
}

/// Decompresses the pages of another reader.
pub(super) struct Unpacked<Pages> {
    packed: Pages,
    /// Upper limit of a page: the size of its column.
    limit_bytes: u64,
}

impl<Pages: PageReader> Unpacked<Pages> {
    pub(super) fn new(packed: Pages, chunk: &ColumnChunkMetaData) -> Self {
        Self { packed, limit_bytes: u64::try_from(chunk.uncompressed_size()).unwrap_or(0) }
    }

    /// Decompresses a page; its first bytes are levels, which version 2 leaves uncompressed.
    fn unpack(&self, bytes: &[u8], levels: usize) -> Result<Vec<u8>, ParquetError> {
        let (levels, packed) = bytes
            .split_at_checked(levels)
            .ok_or_else(|| damaged("levels longer than their page"))?;
        let mut whole = levels.to_vec();
        if packed.is_empty() {
            return Ok(whole);
        }
        let decoder = StreamingDecoder::new(packed).map_err(damaged)?;
        let size = decoder.take(self.limit_bytes + 1).read_to_end(&mut whole).map_err(damaged)?;
        if size as u64 > self.limit_bytes {
            return Err(damaged("a page larger than its column"));
        }
        Ok(whole)
    }
}

fn damaged(cause: impl ToString) -> ParquetError {
    ParquetError::General(format!("Zstandard: {}", cause.to_string()))
}

impl<Pages: PageReader> PageReader for Unpacked<Pages> {
    fn get_next_page(&mut self) -> Result<Option<Page>, ParquetError> {
        let Some(mut page) = self.packed.get_next_page()? else { return Ok(None) };
        match &mut page {
            Page::DataPageV2 { is_compressed: false, .. } => {}
            Page::DataPageV2 { buf, def_levels_byte_len, rep_levels_byte_len, .. } => {
                let levels = *def_levels_byte_len as usize + *rep_levels_byte_len as usize;
                *buf = self.unpack(buf, levels)?.into();
            }
            Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. } => {
                *buf = self.unpack(buf, 0)?.into();
            }
        }
        Ok(Some(page))
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>, ParquetError> {
        self.packed.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<(), ParquetError> {
        self.packed.skip_next_page()
    }
}

impl<Pages: PageReader> Iterator for Unpacked<Pages> {
    type Item = Result<Page, ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

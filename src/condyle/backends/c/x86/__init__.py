"""One evaluation and batch as assembly for x86-64, as a C compiler takes it at file scope."""

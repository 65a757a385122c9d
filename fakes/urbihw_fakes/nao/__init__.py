"""A Nao: NAOqi's services over QiMessaging, and the body behind them.

``codec`` (values and messages), ``body`` (joints, walking, falling), ``services`` with ``motion`` and ``others`` (what
NAOqi offers), ``device`` (who calls what on which connection), ``endpoint`` (TCP, several connections).
"""
